from setuptools import find_packages, setup

package_name = 'pedestal_operator'

setup(
    name=package_name,
    version='0.2.0',
    packages=find_packages(exclude=['test']),
    package_data={package_name: ['static/*', 'static/uplot/*', 'viewers/files/*']},
    data_files=[
        ('share/ament_index/resource_index/packages', ['resource/' + package_name]),
        ('share/' + package_name, ['package.xml']),
    ],
    install_requires=['numpy', 'rich', 'starlette', 'uvicorn', 'websockets'],
    extras_require={'live': ['foxglove-sdk'],
                    'test': ['pytest', 'axe-playwright-python', 'foxglove-sdk', 'ikpy', 'playwright', 'protobuf',
                             'scipy']},
    python_requires='>=3.10',
    zip_safe=False,
    maintainer='pedestal maintainers',
    maintainer_email='pedestal@example.org',
    description='Operation of the antenna by persons and other programs: console, page, rotator protocols.',
    license='Apache-2.0',
    entry_points={'console_scripts': [
        'easycomm_node = pedestal_common.node.run:main',
        'frames_node = pedestal_common.node.run:main',
        'live_node = pedestal_common.node.run:main',
        'operator_page = pedestal_common.node.run:main',
        'rotctld_node = pedestal_common.node.run:main',
    ]},
)
