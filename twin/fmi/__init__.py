"""FMUs: description, export of components, import of anyone's."""
