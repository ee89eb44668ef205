/** One line for the person; none: takes it away. */
export function tell(text) {
  const message = document.getElementById('message');
  message.className = text ? 'error' : '';
  message.textContent = text;
}
