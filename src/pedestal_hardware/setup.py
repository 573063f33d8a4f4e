from setuptools import find_packages, setup

package_name = 'pedestal_hardware'

setup(
    name=package_name,
    version='0.2.0',
    packages=find_packages(exclude=['test']),
    data_files=[
        ('share/ament_index/resource_index/packages', ['resource/' + package_name]),
        ('share/' + package_name, ['package.xml']),
    ],
    install_requires=['numpy', 'numba'],
    extras_require={'can': ['canopen', 'python-can'], 'serial': ['pyserial'], 'nmea': ['pynmea2'], 'sdr': ['pyzmq'],
                    'test': ['pytest', 'canopen', 'python-can', 'pyserial', 'pynmea2', 'pyzmq', 'scipy']},
    python_requires='>=3.10',
    zip_safe=False,
    maintainer='pedestal maintainers',
    maintainer_email='pedestal@example.org',
    description='Servo drives, rotators, receivers and INS in place of simulated nodes.',
    license='Apache-2.0',
    entry_points={'console_scripts': [
        'drive_node = pedestal_common.node.run:main',
        'ins_input_node = pedestal_common.node.run:main',
        'level_receiver_node = pedestal_common.node.run:main',
        'rotator_node = pedestal_common.node.run:main',
        'monopulse_receiver_node = pedestal_common.node.run:main',
    ]},
)
