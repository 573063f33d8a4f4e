from setuptools import find_packages, setup

package_name = 'acu_tracker'

setup(
    name=package_name,
    version='0.2.0',
    packages=find_packages(exclude=['test']),
    data_files=[
        ('share/ament_index/resource_index/packages', ['resource/' + package_name]),
        ('share/' + package_name, ['package.xml']),
    ],
    install_requires=['numpy', 'numba'],
    extras_require={'test': ['pytest', 'scipy', 'filterpy', 'hypothesis', 'skyfield', 'skyfield-data',
                             'astropy; python_version >= "3.11"']},
    python_requires='>=3.10',
    zip_safe=False,
    maintainer='pedestal maintainers',
    maintainer_email='pedestal@example.org',
    description='Antenna control unit: target estimators, modes, position loop and program track.',
    license='Apache-2.0',
    entry_points={'console_scripts': [
        'acu_node = pedestal_common.node.run:main',
    ]},
)
