"""The only package that knows libsumo and TraCI: sessions, options, vehicle types, routes, configurations, outputs."""
