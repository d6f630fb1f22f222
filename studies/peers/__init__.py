"""The study `peers`: the same press-and-slide problem by evfem and by other packages."""
