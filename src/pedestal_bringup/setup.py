from glob import glob

from setuptools import find_packages, setup

package_name = 'pedestal_bringup'

setup(
    name=package_name,
    version='0.2.0',
    packages=find_packages(exclude=['test']),
    package_data={package_name: ['scenarios/*.yaml']},
    data_files=[
        ('share/ament_index/resource_index/packages', ['resource/' + package_name]),
        ('share/' + package_name, ['package.xml']),
        ('share/' + package_name + '/config', glob('pedestal_bringup/scenarios/*.yaml')),
        ('share/' + package_name + '/launch', glob('launch/*.launch.py')),
    ],
    install_requires=['numpy', 'numba', 'PyYAML'],
    extras_require={'test': ['pytest']},
    python_requires='>=3.10',
    zip_safe=False,
    maintainer='pedestal maintainers',
    maintainer_email='pedestal@example.org',
    description='Scenarios of the antenna, started as a graph, by ros2 launch, or as a closed loop without ROS.',
    license='Apache-2.0',
)
