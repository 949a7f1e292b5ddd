# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Install the package: by colcon where ROS expects it, by pip for what needs no ROS."""

from glob import glob
from pathlib import Path
import sys
from xml.etree import ElementTree

from setuptools import find_packages, setup

PACKAGE = 'dp_swing_ros'
manifest = ElementTree.parse(Path(__file__).resolve().with_name('package.xml'))

# Of a wheel, pip puts every script on the PATH, where `logger` would hide the system's; colcon
# puts them where `ros2 run` looks. What makes a wheel calls one of these commands, colcon none.
for_pip = not {'bdist_wheel', 'dist_info', 'editable_wheel'}.isdisjoint(sys.argv)
ONE_FOR_ALL = ['dp_swing_ros = dp_swing_ros.__main__:main']
EXECUTABLES = [
    'plant = dp_swing_ros.executables:plant',
    'mpc = dp_swing_ros.executables:mpc',
    'relay = dp_swing_ros.executables:relay',
    'logger = dp_swing_ros.executables:logger',
    'replay = dp_swing_ros.executables:replay',
    'console = dp_swing_ros.executables:console',
    'analyse = dp_swing_ros.executables:analyse',
    'compare = dp_swing_ros.executables:compare',
    'demo = dp_swing_ros.executables:demo',
    'evaluate = dp_swing_ros.executables:evaluate',
    'export = dp_swing_ros.executables:export',
    'identify = dp_swing_ros.executables:identify',
    'import = dp_swing_ros.executables:import_log',
    'learn = dp_swing_ros.executables:learn',
    'recover = dp_swing_ros.executables:recover',
    'parameters = dp_swing_ros.executables:parameters',
    'play = dp_swing_ros.executables:play',
    'train = dp_swing_ros.executables:train',
    'verify = dp_swing_ros.executables:verify',
]

setup(
    name=PACKAGE,
    version=manifest.findtext('version'),
    description=manifest.findtext('description'),
    maintainer=manifest.findtext('maintainer'),
    maintainer_email=manifest.find('maintainer').get('email'),
    license=manifest.findtext('license'),
    packages=find_packages(include=[PACKAGE, f'{PACKAGE}.*']),
    package_data={f'{PACKAGE}.report': ['*.css', '*.html', '*.js'],
                  f'{PACKAGE}.console': ['page/*', 'page/*/*']},
    data_files=[
        ('share/ament_index/resource_index/packages', [f'resource/{PACKAGE}']),
        (f'share/{PACKAGE}', ['package.xml']),
        (f'share/{PACKAGE}/config', sorted(glob('config/*'))),
    ],
    python_requires='>=3.10',
    # all that needs no ROS; pyproject.toml has the same for `make setup`
    install_requires=[
        'jinja2',
        'joblib',
        'lz4',
        'matplotlib',
        'mcap',
        'mcap-ros2-support',
        'numba',
        'numpy',
        'pandas',
        'pillow',
        'pyyaml',
        'scipy',
        'tornado',
        'tqdm',
        'zstandard',
    ],
    extras_require={
        'dask': ['distributed'],
        'parquet': ['pyarrow'],
        'rig': ['mujoco'],
        'torch': ['torch'],
        # `colcon test` runs pytest only for a package that asks for it here
        'test': ['pytest'],
    },
    zip_safe=False,
    entry_points={'console_scripts': ONE_FOR_ALL if for_pip else EXECUTABLES},
)
