"""What every room uses: checks of input, tables, fingerprints, whole-or-nothing files, notices, views."""
