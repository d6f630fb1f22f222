"""The study `stability`: hard cases, hostile files and runs that are killed."""
