"""What is not collected."""

from importlib.util import find_spec

#: compiled loops are part of evfem[fast]
collect_ignore = [] if find_spec("numba") else ["tissue/kernels"]
