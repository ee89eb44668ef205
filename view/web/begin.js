// Unpacks the page's script. What the script of this hash loads may run, by 'strict-dynamic'; from data:, as the sound's does.
(async () => {
  const bytes = Uint8Array.from(atob(document.getElementById('app').textContent), (c) => c.charCodeAt(0));
  const text = await new Response(new Blob([bytes]).stream().pipeThrough(new DecompressionStream('gzip'))).text();
  const script = document.createElement('script');
  script.src = `data:text/javascript;charset=utf-8,${encodeURIComponent(text)}`;
  document.body.append(script);
  script.remove();
})();
