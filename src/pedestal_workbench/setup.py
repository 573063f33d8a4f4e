from setuptools import find_packages, setup

package_name = 'pedestal_workbench'

setup(
    name=package_name,
    version='0.2.0',
    packages=find_packages(exclude=['test']),
    data_files=[
        ('share/ament_index/resource_index/packages', ['resource/' + package_name]),
        ('share/' + package_name, ['package.xml']),
    ],
    install_requires=['numpy', 'scipy', 'matplotlib', 'rich', 'joblib', 'PyYAML'],
    extras_require={'cluster': ['dask', 'distributed'],
                    'test': ['pytest', 'dask', 'distributed', 'katpoint']},
    python_requires='>=3.10',
    zip_safe=False,
    maintainer='pedestal maintainers',
    maintainer_email='pedestal@example.org',
    description='Experiments on recordings and scenarios of the antenna: recompute, trials, tuning, calibration.',
    license='Apache-2.0',
)
