// Which rules of html-validate the page keeps: all of its standard, accessibility and document
// rules. Each exception says why.
module.exports = {
  root: true,
  extends: ["html-validate:standard", "html-validate:a11y", "html-validate:document"],
  rules: {
    // A table that scrolls sideways is a named region that the keyboard can reach. A <section>
    // would be the same to a screen reader, but a chapter to style sheets and to the outline.
    "prefer-native-element": ["error", { exclude: ["region"] }],
  },
};
