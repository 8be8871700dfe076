"""Sets of terms: their rows stretch by stretch, what the inexactness of links changes, and what is known of a set."""
