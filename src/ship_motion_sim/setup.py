from setuptools import find_packages, setup

package_name = 'ship_motion_sim'

setup(
    name=package_name,
    version='0.2.0',
    packages=find_packages(exclude=['test']),
    data_files=[
        ('share/ament_index/resource_index/packages', ['resource/' + package_name]),
        ('share/' + package_name, ['package.xml']),
    ],
    install_requires=['numpy', 'numba', 'scipy'],
    extras_require={'test': ['pytest', 'python-ins', 'pynmea2']},
    python_requires='>=3.10',
    zip_safe=False,
    maintainer='pedestal maintainers',
    maintainer_email='pedestal@example.org',
    description='Wave-driven ship motion with its IMU, and the inertial navigation system that measures it.',
    license='Apache-2.0',
    entry_points={'console_scripts': [
        'ship_motion_node = pedestal_common.node.run:main',
        'ins_node = pedestal_common.node.run:main',
    ]},
)
