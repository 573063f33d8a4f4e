from setuptools import find_packages, setup

package_name = 'pedestal'

setup(
    name=package_name,
    version='0.1.0',
    packages=find_packages(exclude=['test']),
    package_data={package_name: ['py.typed']},
    data_files=[
        ('share/ament_index/resource_index/packages', ['resource/' + package_name]),
        ('share/' + package_name, ['package.xml']),
    ],
    install_requires=['numpy', 'matplotlib'],
    extras_require={'test': ['pytest', 'nbclient', 'ipykernel']},
    python_requires='>=3.10',
    zip_safe=False,
    maintainer='pedestal maintainers',
    maintainer_email='pedestal@example.org',
    description='The tracking-antenna pedestal as a Python library: scenarios, runs, trials and recordings as numpy '
                'arrays, without ROS.',
    license='Apache-2.0',
)
