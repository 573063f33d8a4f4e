// Return the faults of the layout of the page: hidden, cut, outside of its panel, too wide, in a wrong order, or small.
() => {
    const faults = [], inside = (inner, outer) => inner.left >= outer.left - 1 && inner.right <= outer.right + 1
        && inner.top >= outer.top - 1 && inner.bottom <= outer.bottom + 1;
    const screen = {left: 0, top: 0, right: innerWidth, bottom: innerHeight};
    for (const id of ['mode', 'reason', 'first-alarm', 'take', 'reset', 'stop']) {
        const element = document.getElementById(id), box = element.getBoundingClientRect();
        const top = document.elementFromPoint((box.left + box.right) / 2, (box.top + box.bottom) / 2);
        const seen = element.contains(top) || top.contains(element);
        if (!inside(box, screen) || (box.width && !seen)) faults.push(`${id} is hidden`);
        if (element.scrollWidth > element.clientWidth + 1 && element.clientWidth) faults.push(`${id} is cut`);
    }
    for (const element of document.querySelectorAll('#controls *')) {
        const box = element.getBoundingClientRect();
        const panel = document.getElementById('controls').getBoundingClientRect();
        if (element.tagName === 'OPTION' || !box.width || inside(box, panel)) continue;
        faults.push(`${element.id || element.textContent} is outside`);
    }
    if (document.documentElement.scrollWidth > innerWidth) faults.push('the page is wider than the screen');
    const below = (id) => document.getElementById(id).getBoundingClientRect().top;
    if (innerWidth <= 900 && below('controls') > below('charts')) faults.push('charts come before the commands');
    for (const element of document.querySelectorAll('body *')) {
        const scale = element.ownerSVGElement ? element.getScreenCTM().a : 1;
        const text = [...element.childNodes].some((node) => node.nodeType === 3 && node.textContent.trim());
        const pixels = scale * parseFloat(getComputedStyle(element).fontSize);
        if (text && element.checkVisibility() && pixels < 11.95) faults.push(`${element.textContent}: ${pixels} px`);
    }
    return faults;
}
