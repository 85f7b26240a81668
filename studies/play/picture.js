// A picture that says where it is clicked. What it shows comes from explore.py.

function render({ model, el }) {
  const image = document.createElement("img");
  image.className = "widget-image";
  image.style.cssText = "max-width:100%;cursor:pointer";
  let address = "";

  function show() {
    URL.revokeObjectURL(address);
    address = URL.createObjectURL(new Blob([model.get("value")], { type: "image/png" }));
    image.src = address;
  }
  image.addEventListener("click", (event) => {
    const { offsetX, offsetY } = event;
    model.send({ x: offsetX / image.clientWidth, y: offsetY / image.clientHeight });
  });
  model.on("change:value", show);
  show();
  el.append(image);
  return () => URL.revokeObjectURL(address);
}

export default { render };
