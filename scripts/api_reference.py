# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The page of the public Python API, docs/api.md: `python scripts/api_reference.py`."""

import ast
from collections.abc import Iterator
import inspect
from pathlib import Path
import textwrap
from typing import Any

import dp_swing_ros

TOP = Path(__file__).parents[1]

HEAD = """\
# The Python API

Made by `make docs` from the docstrings. The names on this page may be imported from
`dp_swing_ros` and will stay: what breaks a program that uses them as it is said here is a new
major version. All else is internal. `import dp_swing_ros` loads none of it; a name is loaded when
it is first asked for. None of it needs ROS.

```python
from dp_swing_ros import controller, measure, plant, simulate
print(measure(simulate(plant({}), controller({'solver': 'ddp'}), duration=5.0)))
```

The arguments of `plant` and `controller` are the [parameters of the nodes](parameters.md) by name;
what they return is for `simulate`, and `controller(values).problem` is a `Problem`. Types that
signatures name and this page does not describe are described where they are defined; `Array` is
`numpy.ndarray`. The [tutorial](tutorial.md) uses most of the names.
"""
SECTIONS = {
    'Run and measure': ('plant', 'controller', 'simulate', 'Controller', 'measure', 'read_episode',
                        'Episode'),
    'Problem and plan': ('Problem', 'policy_rollout', 'Rollout', 'Plan', 'SolverStats', 'Status'),
    'Registries': ('SOLVERS', 'ESTIMATORS', 'INTEGRATORS'),
    'Write one of your own': ('Parameters', 'parameter', 'Solver', 'policy_of', 'generator',
                              'Estimator', 'Estimate', 'Commands', 'Drive', 'hold',
                              'PendulumParameters', 'Integrator', 'moved'),
    'Errors': ('ParameterError', 'UserError')}
REGISTRIES = {
    'SOLVERS': 'Classes of solvers by name, those of other packages too (entry points of the\n'
               'group `dp_swing_ros.solvers`). Each is built and called as a `Solver`.',
    'ESTIMATORS': 'Classes of estimators by name, those of other packages too\n'
                  '(`dp_swing_ros.estimators`). Each is built and called as an `Estimator`.',
    'INTEGRATORS': 'Integrators by name, those of other packages too (`dp_swing_ros.models`):\n'
                   'what the parameters `integrator` of the plant and `model` of the mpc choose '
                   'from.'}
WIDTH = 99
GLUE = '\0'   # in place of a space at which no line is folded


def reference() -> str:
    """Return the page as Markdown."""
    parts = [HEAD]
    for section, names in SECTIONS.items():
        parts += [f'## {section}\n', *(entry(name) for name in names)]
    return '\n'.join(parts)


def entry(name: str) -> str:
    """Return what the page says of a name."""
    value = getattr(dp_swing_ros, name)
    place = dp_swing_ros.PUBLIC[name] if name in REGISTRIES else (
        value.__module__.removeprefix('dp_swing_ros.'))
    file = f'dp_swing_ros/{place.replace(".", "/")}'
    file += '.py' if (TOP / f'{file}.py').is_file() else '/__init__.py'
    title = f'### {name}\n\n`{file}`\n'
    if name in REGISTRIES:
        return f'{title}\n{REGISTRIES[name]}\n'
    source = inspect.getsource(value)
    lines = '\n'.join(stub(ast.parse(source).body[0], source.splitlines()))
    return f'{title}\n```python\n{lines}\n```\n'


def stub(node: Any, source: list[str], indent: int = 0) -> Iterator[str]:
    """Yield a function or a class without its statements: head, docstring, fields, methods."""
    if isinstance(node, ast.ClassDef):
        bases = ', '.join(map(ast.unparse, node.bases))
        yield f'class {node.name}({bases}):' if bases else f'class {node.name}:'
    else:
        yield from (f'{" " * indent}@{ast.unparse(one)}' for one in node.decorator_list)
        yield f'{head(node, indent)}:'
    docstring = node.body[0]
    yield from source[docstring.lineno - 1:docstring.end_lineno]
    for each in node.body[1:] if isinstance(node, ast.ClassDef) else ():
        if isinstance(each, (ast.AnnAssign, ast.Assign)):
            yield from source[each.lineno - 1:each.end_lineno]
        elif isinstance(each, ast.FunctionDef) and (
                each.name == '__init__' or not each.name.startswith('_')):
            yield ''
            yield from stub(each, source, 4)


def head(node: Any, indent: int = 0) -> str:
    """Return the first line of a function but for its colon, folded where it is long."""
    returns = f' -> {ast.unparse(node.returns)}' if node.returns else ''
    begin = f'{" " * indent}def {node.name}('
    whole = ast.unparse(node.args).replace(' ', GLUE).replace(f',{GLUE}', ', ')
    lines = textwrap.wrap(whole, WIDTH - len(begin) - len(returns) - 2)
    return (begin + f'\n{" " * len(begin)}'.join(lines) + f'){returns}').replace(GLUE, ' ')


if __name__ == '__main__':
    print(reference(), end='')
