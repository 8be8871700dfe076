"""A fleet of simulated arms over months: what wears, slips, drifts and is swapped, with the truth beside it."""
