"""Results opened: reported, compared, inspected."""
