"""What every other package uses: encounters, observations, registries, random streams, units, files, errors."""
