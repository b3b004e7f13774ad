// The button that ends the session.

document.getElementById("log-out")?.addEventListener("click", async () => {
  const token = document.querySelector('meta[name="csrf"]').content;
  await fetch("/api/v1/logout", { method: "POST", headers: { "X-CSRF-Token": token } });
  location.assign("/");
});
