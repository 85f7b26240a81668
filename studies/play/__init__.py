"""A container to play with in a notebook: to unload by hand, and to watch agents unload.

Read ``episode``, which knows no widgets; then ``replay``, ``canvas``, ``playground`` and
``agent_view``; ``animation`` is the README's moving picture. ``explore`` puts any figure under
sliders. ``page`` makes the page for a browser alone.
"""
