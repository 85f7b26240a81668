"""One colour for each package, in every picture."""

# Packages 0–12 as RGB in [0, 1]: large packages dark, small ones light.
PACKAGE_COLOURS = tuple(
    tuple(int(code[i : i + 2], 16) / 255 for i in (0, 2, 4))
    for code in (
        "1f3a5f", "2e6f95", "5fa8d3", "264d3b", "3f8f63", "7a3b69", "c05299",
        "e07a5f", "b5838d", "f2b880", "8d6a9f", "d4a373", "f6e27f",
    )
)  # fmt: skip


def package_colour(package: int) -> tuple[float, float, float]:
    """RGB of a package; numbers above 12 start again from 0."""
    return PACKAGE_COLOURS[package % len(PACKAGE_COLOURS)]
