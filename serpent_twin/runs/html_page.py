"""Hold the page of a report, and its style."""

PAGE = """<!doctype html>
<html lang="en">
<head>
<meta charset="utf-8">
<meta name="viewport" content="width=device-width, initial-scale=1">
<title>{{ report.title }}</title>
<style>{{ style | safe }}</style>
</head>
<body>
<main>
<h1>{{ report.title }}</h1>
<p class="lead">{{ report.lead }}</p>
{% for section in report.sections %}
<section>
<h2>{{ section.title }}</h2>
{% for paragraph in section.text.split("\n\n") if paragraph %}
<p>{{ paragraph }}</p>
{% endfor %}
{% for block in section.blocks %}
{% if block is table %}
{% set styles = block.styles %}
<div class="wide"><table>
<thead><tr>
{% for name in block.header %}
<th{% if styles[loop.index0] %} class="{{ styles[loop.index0] }}"{% endif %}>{{ name }}</th>
{% endfor %}
</tr></thead>
<tbody>
{% for row in block.rows %}
<tr{% if loop.index0 in block.marked %} class="marked"{% endif %}>
{% for cell in row %}
<td{% if styles[loop.index0] %} class="{{ styles[loop.index0] }}"{% endif %}>{{ cell }}</td>
{% endfor %}
</tr>
{% endfor %}
</tbody>
</table></div>
{% if block.note %}<p class="note">{{ block.note }}</p>{% endif %}
{% else %}
<figure>
<img src="{{ sources[block.name] }}" alt="{{ block.caption }}">
<figcaption>{{ block.caption }}</figcaption>
</figure>
{% endif %}
{% endfor %}
</section>
{% endfor %}
{% if report.facts %}
<footer>
<h2>Where this comes from</h2>
<dl>
{% for name, value in report.facts.items() %}
<dt>{{ name }}</dt><dd>{{ value }}</dd>
{% endfor %}
</dl>
</footer>
{% endif %}
</main>
</body>
</html>
"""
"""Jinja's template of a report; `sources` has the pictures as data, by name"""

STYLE = """
:root { color-scheme: light dark; --ink: #1d2129; --soft: #5c6470; --line: #d9dce1;
  --paper: #fdfdfc; --mark: #f3f0e6; --accent: #a8471c; }
@media (prefers-color-scheme: dark) { :root { --ink: #e4e6ea; --soft: #9aa2ad; --line: #363b43;
  --paper: #16181c; --mark: #262420; --accent: #e8935f; } }
body { margin: 0; background: var(--paper); color: var(--ink);
  font: 17px/1.55 Charter, "Bitstream Charter", "Source Serif 4", Georgia, serif; }
main { max-width: 60rem; margin: 0 auto; padding: 3.5rem 1.5rem 5rem; }
h1 { font-size: 2.1rem; line-height: 1.15; margin: 0 0 .8rem; letter-spacing: -.01em; }
h2 { font-size: 1.3rem; margin: 3rem 0 .6rem; }
p { max-width: 44rem; margin: 0 0 1rem; }
.lead { font-size: 1.2rem; line-height: 1.5; color: var(--soft);
  border-left: 3px solid var(--accent); padding-left: 1rem; }
.wide { overflow-x: auto; margin: 1.2rem 0 .5rem; }
table { border-collapse: collapse; font: 14px/1.35 system-ui, "Segoe UI", sans-serif;
  font-variant-numeric: tabular-nums; white-space: nowrap; }
th { text-align: left; font-weight: 600; color: var(--soft); vertical-align: bottom;
  border-bottom: 1.5px solid var(--ink); padding: .35rem .8rem .35rem 0; }
td { border-bottom: 1px solid var(--line); padding: .4rem .8rem .4rem 0; }
th:not(:first-child), td:not(:first-child) { padding-left: .4rem; }
th { white-space: normal; }
.number { text-align: right; }
.text { white-space: normal; min-width: 7rem; }
td { vertical-align: top; }
.marked td { font-weight: 650; background: var(--mark); }
.note, figcaption { font: 14px/1.45 system-ui, "Segoe UI", sans-serif; color: var(--soft); }
figure { margin: 1.5rem 0 2rem; }
figure img { width: 100%; background: #fff; border-radius: 6px; }
figcaption { margin-top: .4rem; max-width: 44rem; }
footer { margin-top: 4rem; border-top: 1px solid var(--line); }
footer h2 { font-size: 1rem; margin: 1.2rem 0 .5rem; }
dl { display: grid; grid-template-columns: max-content 1fr; gap: .15rem 1.2rem; margin: 0;
  font: 13px/1.5 ui-monospace, Menlo, Consolas, monospace; color: var(--soft); }
dd { margin: 0; overflow-wrap: anywhere; }
"""
"""Style sheet, light and dark"""
