from setuptools import find_packages, setup

package_name = 'pedestal'

setup(
    name=package_name,
    version='0.2.0',
    packages=find_packages(exclude=['test']),
    package_data={package_name: ['py.typed', 'samples/*']},
    data_files=[
        ('share/ament_index/resource_index/packages', ['resource/' + package_name]),
        ('share/' + package_name, ['package.xml']),
    ],
    install_requires=['argcomplete', 'numpy', 'matplotlib', 'rich'],
    extras_require={'test': ['pytest', 'nbclient', 'ipykernel', 'icalendar']},
    python_requires='>=3.10',
    zip_safe=False,
    maintainer='pedestal maintainers',
    maintainer_email='pedestal@example.org',
    description='The command and the Python library of the tracking antenna: run, record, judge and tune it.',
    license='Apache-2.0',
    entry_points={'console_scripts': ['pedestal = pedestal.cli:main']},
)
