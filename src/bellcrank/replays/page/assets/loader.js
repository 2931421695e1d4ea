"use strict";
// The only script that is in the page uncompressed: it inflates and adds the others. The page's policy allows exactly
// these scripts, by their hashes.

/** The inflated bytes of the base64 text in an element. */
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
    if (typeof DecompressionStream === "undefined") throw new Error("it requires a browser released in 2023 or later.");
    const { scripts, licences } = JSON.parse(new TextDecoder().decode(await inflated("library")));
    for (const text of scripts) document.head.append(Object.assign(document.createElement("script"), { textContent: text }));
    await window.bellcrank.open(licences);
  } catch (error) {
    document.getElementById("message").textContent = `This page could not be shown: ${error.message}`;
    throw error;
  }
})();
