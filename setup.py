# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Install the package where ROS expects it; colcon calls this."""

from glob import glob
from pathlib import Path
from xml.etree import ElementTree

from setuptools import find_packages, setup

PACKAGE = 'dp_swing_ros'
manifest = ElementTree.parse(Path(__file__).resolve().with_name('package.xml'))

setup(
    name=PACKAGE,
    version=manifest.findtext('version'),
    description=manifest.findtext('description'),
    maintainer=manifest.findtext('maintainer'),
    maintainer_email=manifest.find('maintainer').get('email'),
    license=manifest.findtext('license'),
    packages=find_packages(include=[PACKAGE, f'{PACKAGE}.*']),
    package_data={f'{PACKAGE}.report': ['*.css', '*.html', '*.js']},
    data_files=[
        ('share/ament_index/resource_index/packages', [f'resource/{PACKAGE}']),
        (f'share/{PACKAGE}', ['package.xml']),
        (f'share/{PACKAGE}/config', sorted(glob('config/*'))),
    ],
    install_requires=['setuptools'],
    # `colcon test` runs pytest only for a package that asks for it here
    extras_require={'test': ['pytest']},
    zip_safe=True,
    entry_points={
        'console_scripts': [
            'plant = dp_swing_ros.nodes.plant:main',
            'mpc = dp_swing_ros.nodes.mpc:main',
            'logger = dp_swing_ros.nodes.logger:main',
            'replay = dp_swing_ros.nodes.replay:main',
            'analyse = dp_swing_ros.tools.analyse:main',
            'compare = dp_swing_ros.tools.compare:main',
            'demo = dp_swing_ros.tools.demo:main',
            'evaluate = dp_swing_ros.tools.evaluate:main',
            'recover = dp_swing_ros.tools.recover:main',
            'parameters = dp_swing_ros.tools.parameters:main',
            'verify = dp_swing_ros.tools.verify:main',
        ],
    },
)
