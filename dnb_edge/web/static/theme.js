// Light, dark or as the system has it. Loaded in the head without `type=module`, so that no page flashes in the wrong one.
"use strict";
(() => {
  const KEY = "dnb-edge.theme";
  const system = matchMedia("(prefers-color-scheme: dark)");

  /** What is kept; null for the system's. A browser without storage keeps nothing. */
  function kept() {
    try {
      const theme = localStorage.getItem(KEY);
      return theme === "light" || theme === "dark" ? theme : null;
    } catch {
      return null;
    }
  }

  function keep(theme) {
    try {
      localStorage.setItem(KEY, theme);
    } catch {
      return;
    }
  }

  function shown() {
    return document.documentElement.dataset.theme ?? (system.matches ? "dark" : "light");
  }

  function label() {
    for (const button of document.querySelectorAll("[data-theme-toggle]")) {
      button.setAttribute("aria-label", shown() === "dark" ? "Use light colours" : "Use dark colours");
    }
  }

  const theme = kept();
  if (theme !== null) document.documentElement.dataset.theme = theme;
  document.addEventListener("DOMContentLoaded", label);
  system.addEventListener("change", label);
  document.addEventListener("click", (event) => {
    if (!event.target.closest("[data-theme-toggle]")) return;
    document.documentElement.dataset.theme = shown() === "dark" ? "light" : "dark";
    keep(document.documentElement.dataset.theme);
    label();
    document.dispatchEvent(new Event("themechange"));
  });
})();
