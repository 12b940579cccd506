"""To be imported before rclpy: ends the process with one line where rclpy would end it, or the nodes not meet."""

from phil_node.signals import end_quietly_on_interrupt
from phil_node.surroundings import leave_if_unusable

end_quietly_on_interrupt()
leave_if_unusable()
