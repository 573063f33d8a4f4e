from glob import glob

from setuptools import find_packages, setup

package_name = 'pedestal_bringup'

setup(
    name=package_name,
    version='0.1.0',
    packages=find_packages(exclude=['test']),
    package_data={package_name: ['scenarios/*.yaml']},
    data_files=[
        ('share/ament_index/resource_index/packages', ['resource/' + package_name]),
        ('share/' + package_name, ['package.xml']),
        ('share/' + package_name + '/config', glob('pedestal_bringup/scenarios/*.yaml')),
        ('share/' + package_name + '/launch', glob('launch/*.launch.py')),
    ],
    install_requires=['numpy', 'numba', 'mcap', 'zstandard', 'lz4', 'rosbags', 'matplotlib', 'rich', 'PyYAML', 'scipy',
                      'joblib', 'filterpy'],
    extras_require={'cluster': ['dask', 'distributed'], 'parquet': ['pyarrow'],
                    'test': ['pytest', 'mcap-ros2-support', 'pyarrow', 'control', 'dask', 'distributed',
                             'ccsds-ndm-py', 'beyond']},
    python_requires='>=3.10',
    zip_safe=False,
    maintainer='pedestal maintainers',
    maintainer_email='pedestal@example.org',
    description='Scenarios, launch, recorder, report and command line of the tracking-antenna pedestal.',
    license='Apache-2.0',
    entry_points={'console_scripts': [
        'recorder_node = pedestal_bringup.recorder_node:main',
        'pedestal = pedestal_bringup.cli:main',
    ]},
)
