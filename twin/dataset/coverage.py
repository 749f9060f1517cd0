"""Coverage of a recipe: the conditions that it names and its episodes meet."""

from twin.dataset.recipe import Recipe


def unmet_conditions(recipe: Recipe) -> str | None:
    """Return a warning if the episodes are too few to meet every stroke and bend that the recipe names."""
    conditions = [recipe.conditions(number) for number in range(recipe.episodes)]
    met = len({(one.stroke_mm, one.sheath_bend_deg) for one in conditions})
    named = len(recipe.strokes_mm) * max(len(recipe.sheath_bends_deg), 1)
    if met >= named:
        return None
    count = "1 episode" if recipe.episodes == 1 else f"{recipe.episodes} episodes"
    return (
        f"{count} of each seed meet only {met} of {named} pairs of stroke and bend; "
        f"for all, take {recipe.combinations}"
    )
