"""The pytest plug-in, part by part."""
