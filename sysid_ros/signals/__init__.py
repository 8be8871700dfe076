"""From measurements to samples and motions: filters, derivatives, even grids. Every velocity comes from here."""
