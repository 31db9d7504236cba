"""The model figures of Hires, Efros & Svoboda (2013), computed again."""
