"""The only package that imports libsumo and TraCI: sessions, options, types, routes, configurations, outputs."""
