"""What is collected."""

from importlib.util import find_spec

#: compiled loops are built with a C compiler
collect_ignore = [] if find_spec("evfem.tissue.kernels.loops") else ["tissue/kernels"]
