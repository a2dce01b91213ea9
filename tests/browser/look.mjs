// Looks at reports in a browser, as a person does: contents, hover, the three-dimensional view, dark mode, print, and axe-core.
//
//   npm install --prefix look playwright-core axe-core
//   NODE_PATH=look/node_modules node tests/browser/look.mjs pictures/ run1/report.html run2/report.html ...
//
// Pictures of every report go into the folder that stands first, under the name of the report's folder. The exit code is 1 where
// something is wrong; it is said in words. CHROMIUM names the browser (default: chromium in the PATH).
import { createRequire } from "node:module";
import { existsSync, mkdirSync, readFileSync } from "node:fs";
import { basename, delimiter, dirname, join, resolve } from "node:path";

const require = createRequire(resolve(process.env.NODE_PATH ?? "node_modules", "x.js"));
const { chromium } = require("playwright-core");
const axe = readFileSync(require.resolve("axe-core"), "utf8");
const [folder, ...reports] = process.argv.slice(2);
mkdirSync(folder, { recursive: true });

const wrong = [];
const check = (report, holds, what) => holds || wrong.push(`${report}: ${what}`);

async function widths(context, report, name) {
  for (const [width, scheme] of [[400, "light"], [800, "light"], [1600, "light"], [1600, "dark"], [400, "dark"]]) {
    const page = await context.newPage();
    await page.setViewportSize({ width, height: 900 });
    await page.emulateMedia({ colorScheme: scheme });
    await page.goto("file://" + resolve(report));
    const beyond = await page.evaluate(() => document.documentElement.scrollWidth - document.documentElement.clientWidth);
    check(report, beyond <= 0, `at ${width} px the page is ${beyond} px too wide`);
    await page.screenshot({ path: `${folder}/${name}-${width}-${scheme}.png`, fullPage: true });
    await page.screenshot({ path: `${folder}/${name}-${width}-${scheme}-top.png` });
    await page.close();
  }
}

// Paper: 14 mm of margin on either side, 96 px an inch.
async function prints(context, report, name) {
  for (const [format, millimetres] of [["A4", 210], ["Letter", 215.9]]) {
    const page = await context.newPage();
    const width = Math.floor(((millimetres - 28) / 25.4) * 96);
    await page.setViewportSize({ width, height: 1000 });
    await page.emulateMedia({ media: "print" });
    await page.goto("file://" + resolve(report));
    const beyond = await page.$$eval("table, svg:not(svg svg), figure, p, li", (all) => all.filter((part) => part.getBoundingClientRect().right > innerWidth + 1).map((part) => part.outerHTML.slice(0, 80)));
    check(report, beyond.length === 0, `on ${format} runs out of the page: ${beyond.slice(0, 2).join(" | ")}`);
    await page.screenshot({ path: `${folder}/${name}-${format}.png`, fullPage: true });
    await page.pdf({ path: `${folder}/${name}-${format}.pdf`, format });
    await page.close();
  }
}

async function clicks(page, report) {
  for (const link of await page.$$eval("nav.contents a", (all) => all.map((a) => a.getAttribute("href")))) {
    await page.click(`nav.contents a[href="${link}"]`);
    const top = await page.$eval(link, (part) => part.getBoundingClientRect().top);
    check(report, Math.abs(top) < 200 || (await page.evaluate(() => scrollY + innerHeight >= document.body.scrollHeight - 2)), `${link} is not reached`);
  }
  for (const link of await page.$$eval("a[href]", (all) => all.map((a) => a.getAttribute("href")))) {
    check(report, link.startsWith("#") && (await page.$(link)) !== null, `${link} leads nowhere`);
  }
  const bar = page.locator("#images svg g rect").first();
  // A series of measured bodies alone has no images.
  if ((await bar.count()) === 0) return;
  await bar.scrollIntoViewIfNeeded();
  await bar.hover();
  const told = await page.textContent("#images output");
  check(report, /px RMS|left out/.test(told), `pointing at a bar says "${told}"`);
}

async function scene(page, report) {
  const svg = page.locator("svg.scene").first();
  if ((await svg.count()) === 0) return check(report, (await page.locator("#images").count()) === 0, "has images and no three-dimensional view");
  // Without a robot there is no arm, and the slider marks a camera.
  const drawn = () => page.$eval("svg.scene", (scene) => scene.innerHTML);
  const changes = async (what, act) => {
    const before = await drawn();
    await act();
    check(report, before !== (await drawn()), `the view does not change by ${what}`);
  };
  await svg.scrollIntoViewIfNeeded();
  const box = await svg.boundingBox();
  const [x, y] = [box.x + box.width / 2, box.y + box.height / 2];
  await changes("mouse", async () => {
    await page.mouse.move(x, y);
    await page.mouse.down();
    await page.mouse.move(x + 60, y + 20, { steps: 4 });
    await page.mouse.up();
  });
  await svg.focus();
  await changes("keys", () => page.keyboard.press("ArrowLeft"));
  await changes("zoom keys", () => page.keyboard.press("+"));
  await changes("buttons", () => page.click("#scene button >> nth=0"));
  await changes("touch", () => page.evaluate(() => {
    const part = document.querySelector("svg.scene");
    part.setPointerCapture = () => {};
    const send = (kind, x) => part.dispatchEvent(new PointerEvent(kind, { pointerId: 9, pointerType: "touch", clientX: x, clientY: 50 }));
    send("pointerdown", 50), send("pointermove", 90), send("pointerup", 90);
  }));
  if (await page.$eval("#scene input", (slider) => Number(slider.max) > 0)) {
    await page.focus("#scene input");
    await changes("the slider", () => page.keyboard.press("End"));
    check(report, (await page.textContent("#scene output")).length > 10, "the slider says nothing");
  }
}

async function accessible(context, report, scheme) {
  const page = await context.newPage();
  await page.emulateMedia({ colorScheme: scheme });
  await page.goto("file://" + resolve(report));
  await page.evaluate(axe);
  const found = await page.evaluate(() => axe.run(document));
  for (const v of found.violations) {
    const words = `axe (${scheme}), ${v.impact}: ${v.id}: ${v.help}: ${v.nodes.slice(0, 2).map((n) => n.html.slice(0, 120)).join(" | ")}`;
    if (["serious", "critical"].includes(v.impact)) check(report, false, words);
    else console.log(`${report}: ${words}`);
  }
  await page.close();
}

const inPath = (name) => process.env.PATH.split(delimiter).map((folder) => join(folder, name)).find(existsSync);
const executablePath = process.env.CHROMIUM ?? inPath("chromium");
if (!executablePath) {
  console.log("there is no chromium in the PATH: name the browser with CHROMIUM");
  process.exit(2);
}
const browser = await chromium.launch({ executablePath, args: ["--no-sandbox"] });
for (const report of reports) {
  const name = basename(dirname(resolve(report)));
  const context = await browser.newContext({ viewport: { width: 1000, height: 900 } });
  const page = await context.newPage();
  page.on("console", (m) => check(report, m.type() !== "error" && m.type() !== "warning", `console: ${m.text()}`));
  page.on("pageerror", (e) => check(report, false, `script: ${e.message}`));
  page.on("request", (r) => check(report, /^(file|data):/.test(r.url()), `asks the network for ${r.url()}`));
  check(report, readFileSync(report).length < 2e6, "is 2 MB or more");
  await page.goto("file://" + resolve(report));
  await clicks(page, report);
  await scene(page, report);
  await prints(context, report, name);
  await widths(context, report, name);
  await accessible(context, report, "light");
  await accessible(context, report, "dark");
  await context.close();
}
await browser.close();
console.log(wrong.length ? wrong.join("\n") : `${reports.length} reports are in order`);
process.exit(wrong.length ? 1 : 0);
