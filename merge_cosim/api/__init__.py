"""What a Python user calls; `import merge_cosim as mc` offers these names, and the command line calls them too."""
