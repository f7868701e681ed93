const slider = document.querySelector(".slider");
if (slider) {
  const [under, over] = slider.querySelectorAll("div");
  const show = (select, layer) => {
    const set = () => { layer.style.backgroundImage = `var(--p${select.value})`; };
    select.addEventListener("change", set);
    set();
  };
  show(document.getElementById("left"), over);
  show(document.getElementById("right"), under);
  const range = slider.querySelector("input");
  range.addEventListener("input", () => slider.style.setProperty("--at", `${range.value}%`));
}
