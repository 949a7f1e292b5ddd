# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The package as pip installs it, without colcon, ROS and torch; and what colcon has instead."""

from importlib.metadata import distribution
import json
import os
from pathlib import Path
import re
import shutil
import subprocess
import sys
import tomllib
from typing import NamedTuple

import pytest

from dp_swing_ros.__main__ import BY_COLCON, NODES, TOOLS

TOP = Path(__file__).parents[1]
BUILT = shutil.ignore_patterns('.*', 'build', 'install', 'log', 'runs', '*.egg-info',
                               '__pycache__')
# an interpreter in which these are not installed
WITHOUT = """
import sys
from importlib.abc import MetaPathFinder

class Refused(MetaPathFinder):
    def find_spec(self, name, path=None, target=None):
        if name.partition('.')[0] in {absent}:
            raise ModuleNotFoundError(f'No module named {{name!r}}', name=name)

sys.meta_path.insert(0, Refused())
"""
ABSENT = {'rclpy', 'ament_index_python', 'builtin_interfaces', 'diagnostic_msgs', 'rcl_interfaces',
          'rosgraph_msgs', 'sensor_msgs', 'std_msgs', 'std_srvs', 'trajectory_msgs', 'torch',
          'distributed'}


# calls one command after the other, as `python -m dp_swing_ros` would, and snippets of Python
CALLING = """
import contextlib, io, json, runpy, sys
from dp_swing_ros.__main__ import main

def called(argv):
    sys.argv = ['__main__.py', *argv]
    out, err = io.StringIO(), io.StringIO()
    with contextlib.redirect_stdout(out), contextlib.redirect_stderr(err):
        try:
            code = main(argv) if argv[0] != 'python' else bool(not runpy.run_path(argv[1]))
        except SystemExit as end:
            code = end.code
    return [code, out.getvalue(), err.getvalue()]

answers = [called(argv) for argv in json.load(sys.stdin)]
json.dump(answers, sys.stdout)
"""
HERE = '--scenarios hanging --seeds 1 --output'
CAMPAIGN = f'evaluate --contestants nothing --duration 0.5 --jobs 1 --no-figures {HERE} campaign'
DEVICES = {device: f'evaluate --contestants mppi:mppi.device={device} {HERE} {device}'
           for device in ('cuda', 'torch')}
CLUSTER = f'evaluate --contestants nothing --dask tcp://127.0.0.1:1 {HERE} cluster'
WHERE = 'where.py'
ANALYSIS = 'analyse my_bag --no-animation --output analysis'
IN_ROS = [*NODES, *BY_COLCON]
HELPFUL = ('console', 'mpc')


class Answer(NamedTuple):
    """What a command printed, and its exit code."""

    code: int
    out: str
    err: str


class Installed:
    """The package in a prefix of its own, and Python to run it in an empty folder."""

    def __init__(self, prefix, here):
        self.prefix, self.here = prefix, here
        self.site, = prefix.glob('lib/python*/site-packages')
        self.environment = {name: os.environ[name] for name in ('PATH', 'HOME')
                            if name in os.environ}
        self.environment['PYTHONPATH'] = f'{here}{os.pathsep}{self.site}'

    def python(self, *arguments, stdin=None):
        return subprocess.run([sys.executable, *map(str, arguments)], cwd=self.here, text=True,
                              env=self.environment, capture_output=True, timeout=280, input=stdin)

    def answers(self, commands):
        """Return what each of the commands answers, all in one process."""
        done = self.python('-c', CALLING, stdin=json.dumps([each.split() for each in commands]))
        assert done.returncode == 0, done.stderr
        return {command: Answer(*each) for command, each in zip(commands, json.loads(done.stdout))}


@pytest.fixture(scope='module')
def installed(tmp_path_factory):
    folder = tmp_path_factory.mktemp('pip')
    shutil.copytree(TOP, folder / 'sources', ignore=BUILT)
    subprocess.run([sys.executable, '-m', 'pip', 'install', '--quiet', '--no-index', '--no-deps',
                    '--no-build-isolation', '--prefix', folder / 'prefix', folder / 'sources'],
                   check=True, cwd=folder)
    here = folder / 'elsewhere'
    here.mkdir()
    (here / 'sitecustomize.py').write_text(WITHOUT.format(absent=sorted(ABSENT)))
    return Installed(folder / 'prefix', here)


@pytest.fixture(scope='module')
def answers(installed, lockstep_bag):
    """Return what all commands of these tests answer where there is no ROS."""
    (installed.here / 'my_bag').symlink_to(lockstep_bag)
    codes = snippets()
    (installed.here / WHERE).write_text(
        'from pathlib import Path; from dp_swing_ros.parameters.files import locate; '
        'print(locate(Path("config/paper.yaml")))')
    for n, code in enumerate(codes):
        (installed.here / f'snippet_{n}.py').write_text(code)
    return installed.answers([
        *(f'{name} --help' for name in (*TOOLS, *HELPFUL)), *IN_ROS, 'parameters',
        'console nothing', CAMPAIGN, *(f'python snippet_{n}.py' for n in range(len(codes))),
        f'python {WHERE}', ANALYSIS, CLUSTER, *DEVICES.values()])


def test_pip_puts_one_name_on_the_path(installed):
    assert [script.name for script in (installed.prefix / 'bin').iterdir()] == ['dp_swing_ros']
    done = installed.python(installed.prefix / 'bin' / 'dp_swing_ros', 'verify', '--help')
    assert done.returncode == 0, done.stderr
    assert done.stdout.startswith('usage: dp_swing_ros verify')


def test_colcon_has_every_tool_and_node_where_ros2_run_looks():
    scripts = {entry.name for entry in distribution('dp_swing_ros').entry_points
               if entry.group == 'console_scripts'}
    assert scripts == {*TOOLS, *NODES, *BY_COLCON}


@pytest.mark.parametrize('tool', TOOLS)
def test_a_tool_needs_no_ros(tool, answers):
    answer = answers[f'{tool} --help']
    assert answer.code == 0, answer.err
    assert answer.out.startswith(f'usage: python -m dp_swing_ros {tool}')


@pytest.mark.parametrize('node', HELPFUL)
def test_the_help_of_a_node_needs_no_ros(node, answers):
    answer = answers[f'{node} --help']
    assert answer.code == 0, answer.err
    assert f'usage: ros2 run dp_swing_ros {node}' in answer.out


@pytest.mark.parametrize('name', IN_ROS)
def test_what_needs_ros_is_refused_in_one_line(name, answers):
    assert answers[name].code == 2
    assert re.fullmatch(rf'dp_swing_ros: error: {name} needs the Python module \w+, which is not '
                        'installed; source .*\n', answers[name].err)


def test_parameters_of_all_nodes_are_printed_without_ros(answers):
    assert answers['parameters'].out == (TOP / 'docs' / 'parameters.md').read_text()


def test_the_console_brings_its_page_and_plays_bags_without_ros(installed, answers):
    assert (installed.site / 'dp_swing_ros' / 'console' / 'page' / 'index.html').is_file()
    answer = answers['console nothing']
    assert (answer.code, "there is no bag 'nothing'" in answer.err) == (2, True), answer


def test_a_campaign_finds_the_parameter_files_that_were_installed(installed, answers):
    found = answers[f'python {WHERE}']
    assert found.out.startswith(str(installed.prefix)), found.err
    assert answers[CAMPAIGN].code == 0, answers[CAMPAIGN].err
    page = (installed.here / 'campaign' / 'summary.md').read_text()
    assert '`nothing` | 0 of 1' in page
    assert 'version not installed' not in page


def snippets():
    """Return the pieces of Python in README that say, or stand where it says, `without ROS`."""
    text = (TOP / 'README.md').read_text()
    return [code for code in re.findall(r'```python\n(.*?)```', text, re.DOTALL)
            if 'needs no ROS' in code or 'simulate(' in code]


def test_what_readme_says_needs_no_ros_needs_none(answers):
    assert len(snippets()) == 2
    for n in range(2):
        answer = answers[f'python snippet_{n}.py']
        assert answer.code == 0, answer.err


def test_a_bag_is_analysed_into_a_whole_page(installed, answers):
    assert (answers[ANALYSIS].code, answers[ANALYSIS].err) == (0, '')
    page = (installed.here / 'analysis' / 'report.html').read_text()
    assert (TOP / 'dp_swing_ros' / 'report' / 'style.css').read_text()[:200] in page


def test_pip_and_make_install_the_same(installed):
    groups = tomllib.loads((TOP / 'pyproject.toml').read_text())['dependency-groups']
    about = next(installed.site.glob('dp_swing_ros-*.dist-info/METADATA')).read_text()
    needed = re.findall(r'^Requires-Dist: ([\w-]+)$', about, re.MULTILINE)
    assert sorted(needed) == sorted(groups['run'])
    assert 'Requires-Dist: torch; extra == "torch"' in about


def test_nothing_that_the_demo_imports_brings_torch(installed):
    modules = ['tools.demo', 'tools.analyse', *(f'nodes.{name}' for name in NODES)]
    imports = '; '.join(f'import dp_swing_ros.{module}' for module in modules)
    done = subprocess.run(
        [sys.executable, '-c', f"""
import sys
{imports}
from dp_swing_ros import controller, SOLVERS
for name in SOLVERS:
    controller({{'solver': name}})
print([name for name in ('torch', 'distributed') if name in sys.modules])
"""], capture_output=True, text=True, check=True)
    assert done.stdout == '[]\n'


def test_a_cluster_without_dask_is_refused_in_one_line(answers):
    assert (answers[CLUSTER].code, answers[CLUSTER].err) == (
        1, 'evaluate: error: --dask needs the Python package distributed, which is not installed; '
        'pip install distributed\n')


@pytest.mark.parametrize('device', DEVICES)
def test_a_device_without_torch_is_refused_in_one_line(device, answers):
    answer = answers[DEVICES[device]]
    assert answer.code == 2
    assert re.fullmatch(rf"evaluate: error: parameter mppi.device is '{device}', but torch is not "
                        r'installed; .*pip install.*\n', answer.err)
