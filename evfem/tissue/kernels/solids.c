/* Compiled element loops of hexahedra (`module.h`). */
#define DIM 3
#define MODULE "solids"
#define INIT PyInit_solids
#include "module.h"
