from setuptools import find_packages, setup

package_name = 'pedestal_station'

setup(
    name=package_name,
    version='0.2.0',
    packages=find_packages(exclude=['test']),
    data_files=[
        ('share/ament_index/resource_index/packages', ['resource/' + package_name]),
        ('share/' + package_name, ['package.xml']),
    ],
    install_requires=['numpy', 'scipy', 'rich'],
    extras_require={'test': ['pytest', 'skyfield', 'icalendar']},
    python_requires='>=3.10',
    zip_safe=False,
    maintainer='pedestal maintainers',
    maintainer_email='pedestal@example.org',
    description='A night of passes: the plan of a station, and the station that tracks it by itself.',
    license='Apache-2.0',
)
