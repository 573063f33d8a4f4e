from setuptools import find_packages, setup

package_name = 'pedestal_results'

setup(
    name=package_name,
    version='0.2.0',
    packages=find_packages(exclude=['test']),
    data_files=[
        ('share/ament_index/resource_index/packages', ['resource/' + package_name]),
        ('share/' + package_name, ['package.xml']),
    ],
    install_requires=['numpy', 'scipy', 'matplotlib', 'fpdf2'],
    extras_require={'test': ['pytest', 'ccsds-ndm-py', 'beyond']},
    python_requires='>=3.10',
    zip_safe=False,
    maintainer='pedestal maintainers',
    maintainer_email='pedestal@example.org',
    description='Results and report of one recorded run of the antenna.',
    license='Apache-2.0',
)
