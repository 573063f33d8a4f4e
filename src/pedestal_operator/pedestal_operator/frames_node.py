"""ROS node for the viewer RViz: it publishes the model of the pedestal on `robot_description`, and its frames on `tf`.

In the folder `viewers`, frames.py computes the frames, and the subfolder `files` contains the model.
"""
from rclpy.qos import QoSProfile

from pedestal_common import parameters
from pedestal_common.graph.nodes import Node
from pedestal_common.node import middleware, shell
from pedestal_common.wire import messages
from pedestal_operator.viewers import frames
from pedestal_operator.viewers.on_demand import FrameSource

FRAME_PERIOD_S = 1.0 / 30.0  # period of the messages on tf [s]
TF_QUEUE_DEPTH = 100  # queue depth of tf, equal to that of tf2 [messages]


class FramesNode(shell.Shell):
    """Publisher of the model at the start, and of the frames while tf has a subscriber, if tf2_msgs is installed."""
    awaits = 'its end'

    def __init__(self, row: Node) -> None:
        super().__init__(row.name, parameters.Parameters)
        text = messages.String(data=frames.PEDESTAL_URDF)
        description = self.create_publisher(middleware.message_class(text.__msgtype__), 'robot_description',
                                            middleware.qos('change', 'written'))
        description.publish(messages.serialize(text))
        try:
            from tf2_msgs.msg import TFMessage
        except ImportError:
            print('frames: robot_description; no tf, because tf2_msgs is not installed: robot_state_publisher can '
                  'publish it', flush=True)
            return
        print('frames: robot_description, tf', flush=True)
        self._frames, self._published_stamp = FrameSource(self), 0
        self._tf = self.create_publisher(TFMessage, 'tf', QoSProfile(depth=TF_QUEUE_DEPTH))
        self.every(FRAME_PERIOD_S, self._publish_frames)

    def _publish_frames(self) -> None:
        self._frames.set_active(self._tf.get_subscription_count() > 0)
        stamp, transforms = self._frames.read()
        if stamp != self._published_stamp:
            self._published_stamp = stamp
            self._tf.publish(messages.serialize(frames.tf_message(stamp, transforms)))
