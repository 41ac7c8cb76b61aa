"""What a Python user calls: `import merge_cosim as mc` shows these names. The command line is made of them, too."""
