"""What the examples of several axes share: a score of bus cycles, its players, and the results.

score.py    what the host does, and when: bus cycles with their instants
chips.py    packets of the three chip families as such cycles, and the positions read by them
velocity.py the velocities and accelerations that keep an axis to a path
play.py     plays a score on the nodes of a board, in virtual or in real time
command.py  the command of an example: starts router, nodes and host, and stops them
accident.py the command of an example of which a node is killed, and rejoins
parts.py    processes: routers, nodes, hosts
result.py   contour error, skew, and what is printed of them
picture.py  the plot
"""
