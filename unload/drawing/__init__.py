"""Loads drawn: still pictures, and a view to turn.

Read ``picture``, then ``view``. Import them where something is drawn, because Matplotlib and plotly
take their time.
"""
