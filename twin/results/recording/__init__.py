"""Recorded signals: files of rows, folders of runs, and reading them."""
