// The page of a gateway that makes its data up (mock.mjs), in a browser, for a test.
import { clean, launch, look, pageFolder } from "./browser.mjs";
import { serve } from "./mock.mjs";

let browser;
/** For before() and after() of a file of tests. */
export const openBrowser = async () => (browser = await launch());
export const closeBrowser = () => browser.close();
export const lookAt = (url, context) => look(browser, url, context);

/** The page of a mock with this story, which the test may change while it looks; it begins when the page has all that there is. */
export const visit = (story, context, todo) => async () => {
  const mock = await serve(pageFolder, 0, story);
  const seen = await lookAt(mock.url, context);
  try {
    await seen.page.locator("[data-channel]").first().waitFor();
    await todo({ ...seen, mock, story });
    clean(seen);
  } finally {
    await seen.page.context().close();
    await mock.close();
  }
};
