// What scrolls sideways can be reached by the keyboard.
window.addEventListener("load", () => {
  for (const part of document.querySelectorAll(".md-typeset__scrollwrap, .equation, .highlight code")) {
    part.tabIndex = 0;
  }
});
