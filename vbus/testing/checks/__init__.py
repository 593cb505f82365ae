"""What the conformance kit asks of a plug-in's chip, plant, protocol or transport."""
