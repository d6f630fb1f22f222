"""Shared by all folders: checks of input, tables, fingerprints, whole-or-nothing files, notices, views."""
