{% macro row(numbers) %}{ {%- for number in numbers %}{{ "%.12g" | format(number) }}{{ "" if loop.last else ", " }}{% endfor -%} }{% endmacro %}
model {{ name }} "Damper identified by damperfit"
{% if physics %}
{{ comments("  //", header(sign, "in f, of the gas law with P_0, V_g0 and gamma", has_table=False) +
    ["law: D. J. Purdy, Proc. IMechE D, 2000, with its two state equations"]) }}
{% else %}
{{ comments("  //", header(sign, "added as gas")) }}
{% for table in tables if table.has_interval %}
{{ comments("  //", ["setting " ~ loop.index] + intervals(of=table)) }}
{% endfor %}
{% endif %}
  parameter Integer setting = 1 "{% for table in tables %}{{ loop.index }}: {{ table.setting | string | replace("\\", "/") | replace('"', "'") | one_line }}{{ "" if loop.last else ", " }}{% endfor %}";
{% if physics %}
{% for quantity in quantities %}
  parameter Real {{ quantity.name }}[{{ tables | length }}] = {{ row(values[quantity.name]) }} "{{ quantity.meaning }}, {{ quantity.unit }}";
{% endfor %}
  parameter Real A_1(unit = "m2") = {{ "%.12g" | format(damper.annulus_area) }} "annulus";
  parameter Real A_2(unit = "m2") = {{ "%.12g" | format(damper.piston_area) }} "full bore";
  parameter Real l_1(unit = "m") = {{ "%.12g" | format(damper.chamber_1_length) }};
  parameter Real l_2(unit = "m") = {{ "%.12g" | format(damper.chamber_2_length) }};
  parameter Real V_g0(unit = "m3") = {{ "%.12g" | format(damper.gas_volume) }} "gas at s_rel = 0";
  parameter Real P_0(unit = "Pa") = {{ "%.12g" | format(damper.gas_pressure) }} "gas pressure at s_rel = 0";
  parameter Real P_amb(unit = "Pa") = {{ "%.12g" | format(damper.ambient_pressure) }} "air, on the rod";
  parameter Real gamma = {{ "%.12g" | format(damper.gas_exponent) }} "gas exponent";
  parameter Real rho(unit = "kg/m3") = {{ "%.12g" | format(damper.oil_density) }} "oil";
  parameter Real friction_band(unit = "m/s") = 0.005 "friction grows to f_f over it; a narrower one lets a car at rest chatter at steps of 1 ms";
  input Real s_rel(unit = "m") "displacement, positive in rebound";
  input Real v_rel(unit = "m/s") "its derivative";
  output Real f(unit = "N") "force, positive in rebound";
  Real m_1(unit = "kg", start = {{ "%.12g" | format(damper.oil_density * damper.chamber_1_volume) }});
  Real m_2(unit = "kg", start = {{ "%.12g" | format(damper.oil_density * damper.chamber_2_volume) }});
  Real V_1(unit = "m3");
  Real V_2(unit = "m3");
  Real V_g(unit = "m3");
  Real P_1(unit = "Pa");
  Real P_2(unit = "Pa");
  Real P_3(unit = "Pa");
  Real w_1(unit = "kg/s");
  Real w_2(unit = "kg/s");
  Real w_3(unit = "kg/s");
initial equation
  m_1 = rho*V_1;
  m_2 = rho*V_2;
equation
  V_1 = A_1*(l_1 - s_rel);
  V_2 = A_2*(l_2 + s_rel);
  V_g = V_g0 - (A_1*l_1 + A_2*l_2 - (m_1 + m_2)/rho);
  P_1 = max(0, k_e[setting]*(m_1/(rho*V_1) - 1) + P_0);
  P_2 = max(0, k_e[setting]*(m_2/(rho*V_2) - 1) + P_0);
  P_3 = P_0*(V_g0/V_g)^gamma;
  w_1 = (P_1 - P_3)/((P_1 - P_3)^2 + 1)^0.25/r_m1[setting];
  w_2 = max(0, P_2 - P_1)/r_m2[setting];
  w_3 = max(0, P_3 - P_2)/r_m3[setting];
  der(m_1) = w_2 - w_1;
  der(m_2) = w_3 - w_2;
  f = P_1*A_1 - P_2*A_2 + P_amb*(A_2 - A_1) + f_f[setting]*max(-1, min(1, v_rel/friction_band));
{% else %}
{# Straight lines between the points, as a sum of bends, which needs no library and no loop. #}
  parameter Real speed[{{ speeds | length }}](each unit = "m/s") = {{ row(speeds) }};
  parameter Real first[{{ tables | length }}](each unit = "N") = {{ row(firsts) }};
  parameter Real bend[{{ tables | length }}, {{ speeds | length }}](each unit = "N.s/m") =
    { {%- for bend in bends %}{{ row(bend) }}{{ "" if loop.last else ",\n     " }}{% endfor -%} };
  input Real s_rel(unit = "m") "displacement, positive in rebound";
  input Real v_rel(unit = "m/s") "its derivative";
  output Real f(unit = "N") "force, positive in rebound";
  Real damping(unit = "N") "table, without gas";
  Real gas(unit = "N") "force at rest";
equation
  damping = first[setting] + bend[setting, 1]*(v_rel - speed[1]){% for k in range(2, speeds | length + 1) %} +
    bend[setting, {{ k }}]*max(0, v_rel - speed[{{ k }}]){% endfor %};
  gas = {% for c in gas %}({{ "%.9g" | format(c) }}){% if loop.index0 %}*s_rel^{{ loop.index0 }}{% endif %}{{ "" if loop.last else " + " }}{% endfor %};
  f = damping + gas;
{% endif %}
end {{ name }};
