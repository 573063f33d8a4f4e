from setuptools import find_packages, setup

package_name = 'adu_drive'

setup(
    name=package_name,
    version='0.2.0',
    packages=find_packages(exclude=['test']),
    data_files=[
        ('share/ament_index/resource_index/packages', ['resource/' + package_name]),
        ('share/' + package_name, ['package.xml']),
    ],
    install_requires=['numpy', 'numba'],
    extras_require={'test': ['pytest', 'scipy', 'sympy']},
    python_requires='>=3.10',
    zip_safe=False,
    maintainer='pedestal maintainers',
    maintainer_email='pedestal@example.org',
    description='Antenna drive unit: current loops, dual-motor gear train, friction and wind of both axes around '
                'the laws of drive_law.',
    license='Apache-2.0',
    entry_points={'console_scripts': [
        'adu_node = pedestal_common.node.run:main',
        'beam_steering_node = pedestal_common.node.run:main',
    ]},
)
