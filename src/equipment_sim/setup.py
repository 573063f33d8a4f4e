from setuptools import find_packages, setup

package_name = 'equipment_sim'

setup(
    name=package_name,
    version='0.2.0',
    packages=find_packages(exclude=['test']),
    data_files=[
        ('share/ament_index/resource_index/packages', ['resource/' + package_name]),
        ('share/' + package_name, ['package.xml']),
    ],
    install_requires=['numpy', 'numba'],
    extras_require={'test': ['pytest', 'canopen', 'python-can', 'pyzmq', 'scipy']},
    python_requires='>=3.10',
    zip_safe=False,
    maintainer='pedestal maintainers',
    maintainer_email='pedestal@example.org',
    description='Simulated equipment for pedestal_hardware: servo drives, samples of a front end, a rotator, an INS.',
    license='Apache-2.0',
    entry_points={'console_scripts': [
        'iq_node = pedestal_common.node.run:main',
        'simulated_drives_node = pedestal_common.node.run:main',
    ]},
)
