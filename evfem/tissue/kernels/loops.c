/* Compiled element loops of the plane (`module.h`). */
#define DIM 2
#define MODULE "loops"
#define INIT PyInit_loops
#include "module.h"
