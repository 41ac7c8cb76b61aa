"""The papers' tables, figures and claims beside ours: what `merge-cosim reproduce` reports."""
