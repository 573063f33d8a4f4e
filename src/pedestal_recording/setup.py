from setuptools import find_packages, setup

package_name = 'pedestal_recording'

setup(
    name=package_name,
    version='0.2.0',
    packages=find_packages(exclude=['test']),
    data_files=[
        ('share/ament_index/resource_index/packages', ['resource/' + package_name]),
        ('share/' + package_name, ['package.xml']),
    ],
    install_requires=['numpy', 'mcap', 'zstandard', 'lz4', 'PyYAML'],
    extras_require={'parquet': ['pyarrow'], 'test': ['pytest', 'mcap-ros2-support', 'pyarrow']},
    python_requires='>=3.10',
    zip_safe=False,
    maintainer='pedestal maintainers',
    maintainer_email='pedestal@example.org',
    description='Records a graph as rosbag2 with MCAP; reads, verifies, recovers and exports recordings.',
    license='Apache-2.0',
    entry_points={'console_scripts': [
        'recorder_node = pedestal_common.node.run:main',
        'pass_recorder_node = pedestal_common.node.run:main',
    ]},
)
