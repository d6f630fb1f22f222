"""What axe-core (evfem[browser]) finds on the page that a browser shows: contrast, names of controls, texts
of pictures, order of headings, what the keyboard reaches.
"""

from importlib.resources import files

#: rules of WCAG 2.1, levels A and AA, and what axe-core calls best practice
RUN = """
const done = arguments[arguments.length - 1];
axe.run(document, {resultTypes: ["violations"]}).then(done, (error) => done({error: `${error}`}));
"""


def barriers(driver):
    """What is wrong, one line each: rule, how bad, the first places of it."""
    driver.execute_script(files("axe_core_python").joinpath("axe.min.js").read_text(encoding="utf-8"))
    found = driver.execute_async_script(RUN)
    assert "error" not in found, found["error"]
    return [
        f"{one['id']} ({one['impact']}): {one['help']}: {[node['target'][-1] for node in one['nodes'][:5]]}"
        for one in found["violations"]
    ]
