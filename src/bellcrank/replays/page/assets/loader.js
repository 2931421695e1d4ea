"use strict";
// The only script that stands in the page as it is: it brings in the others, which come deflated. The page's policy
// lets exactly those texts run, by their hashes.

/** Bytes of the base64 text in the element of that id, inflated. */
async function inflated(id) {
  const text = atob(document.getElementById(id).textContent);
  const bytes = new Uint8Array(text.length);
  for (let i = 0; i < text.length; i++) bytes[i] = text.charCodeAt(i);
  const stream = new Blob([bytes]).stream().pipeThrough(new DecompressionStream("deflate"));
  return new Uint8Array(await new Response(stream).arrayBuffer());
}

window.bellcrank = { inflated };
window.bellcrank.ready = (async () => {
  try {
    if (typeof DecompressionStream === "undefined") throw new Error("it needs a browser of 2023 or later.");
    const { scripts, licences } = JSON.parse(new TextDecoder().decode(await inflated("library")));
    for (const text of scripts) document.head.append(Object.assign(document.createElement("script"), { textContent: text }));
    await window.bellcrank.open(licences);
  } catch (error) {
    document.getElementById("message").textContent = `This page could not be shown: ${error.message}`;
    throw error;
  }
})();
