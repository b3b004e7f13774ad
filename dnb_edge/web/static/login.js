// The login form: sends the code, says what was wrong with it, and goes on to the page that was wanted.

const form = document.getElementById("log-in");

async function logIn(event) {
  event.preventDefault();
  const wrong = document.getElementById("wrong");
  const button = form.querySelector("button");
  wrong.textContent = "";
  button.disabled = true;
  try {
    const answer = await fetch("/api/v1/login", {
      method: "POST",
      headers: { "Content-Type": "application/json" },
      body: JSON.stringify({ code: form.elements.code.value }),
    });
    if (answer.ok) {
      location.assign(form.dataset.next);
      return;
    }
    wrong.textContent = (await answer.json()).error.text;
  } catch {
    wrong.textContent = "The box does not answer: is this device still on its network?";
  }
  button.disabled = false;
  form.elements.code.select();
}

form?.addEventListener("submit", logIn);
