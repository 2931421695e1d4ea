// ---- winding and housing temperature over the cycle in the periodic steady state

/** Of the hottest cycle with known temperatures; else why there is none. */
function temperatureChart({ cycles, temperatureLimits, temperatureText }, width) {
  const withTemperature = cycles.filter(({ temperature }) => temperature);
  if (temperatureText) return nothingToPlot(temperatureText);
  const hottest = withTemperature.reduce((a, b) => (Math.max(...b.temperature.winding) > Math.max(...a.temperature.winding) ? b : a));
  const { time, winding, housing } = hottest.temperature;
  const limits = [["winding", temperatureLimits.winding], ["housing", temperatureLimits.housing]].filter(([, limit]) => limit !== null);
  const plot = makeSvgPlot({
    width,
    height: Math.round(Math.min(Math.max(0.42 * width, 170), 240)),
    x: { label: "time in the cycle [s]", range: [time[0], time.at(-1)] },
    y: { label: "temperature [°C]", range: rangeOf([...winding, ...housing], limits.map(([, limit]) => limit)) },
    title: `temperature over cycle ${hottest.name}`,
  });
  for (const [what, limit] of limits) {
    plot.line(plot.across(limit), "limit");
    plot.note([time.at(-1), limit], `${what} limit ${formatNumber(limit)} °C`);
  }
  plot.line(time.map((t, i) => [t, winding[i]]), "winding");
  plot.line(time.map((t, i) => [t, housing[i]]), "housing");
  const legend = plotLegend([["winding", `winding, at most ${formatNumber(Math.max(...winding), 4)} °C`],
    ["housing", `housing, at most ${formatNumber(Math.max(...housing), 4)} °C`]]);
  const caption = `Periodic steady state of cycle ${hottest.name}${cycles.length > 1 ? ", the hottest" : ""}.`;
  return element("figure", { className: "temperature" }, plot.root, legend, element("figcaption", { textContent: caption }));
}
