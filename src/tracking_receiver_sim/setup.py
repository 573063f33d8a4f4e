from setuptools import find_packages, setup

package_name = 'tracking_receiver_sim'

setup(
    name=package_name,
    version='0.2.0',
    packages=find_packages(exclude=['test']),
    data_files=[
        ('share/ament_index/resource_index/packages', ['resource/' + package_name]),
        ('share/' + package_name, ['package.xml']),
    ],
    install_requires=['numpy', 'numba', 'scipy', 'sgp4', 'skyfield', 'pynmea2'],
    extras_require={'test': ['pytest', 'filterpy', 'beyond']},
    python_requires='>=3.10',
    zip_safe=False,
    maintainer='pedestal maintainers',
    maintainer_email='pedestal@example.org',
    description='Targets (satellite pass, recorded track, flyby) and the monopulse tracking receiver that '
                'sees them.',
    license='Apache-2.0',
    entry_points={'console_scripts': [
        'tracking_receiver_node = pedestal_common.node.run:main',
    ]},
)
