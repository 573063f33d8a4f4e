from setuptools import find_packages, setup

package_name = 'pedestal_common'

setup(
    name=package_name,
    version='0.2.0',
    packages=find_packages(exclude=['test']),
    package_data={package_name: ['*.xml']},
    data_files=[
        ('share/ament_index/resource_index/packages', ['resource/' + package_name]),
        ('share/' + package_name, ['package.xml']),
    ],
    install_requires=['numpy', 'numba', 'pyerfa', 'rosbags', 'scipy', 'sgp4', 'PyYAML'],
    extras_require={'test': ['pytest']},
    python_requires='>=3.10',
    zip_safe=False,
    maintainer='pedestal maintainers',
    maintainer_email='pedestal@example.org',
    description='Code that the packages of the pedestal share: line-of-sight geometry, parameters, topic table '
                'and node shell.',
    license='Apache-2.0',
)
